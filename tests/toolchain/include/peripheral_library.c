/* Calls every function of the peripheral library on the chip and checks the registers afterwards; the exit status is the
 * line of the first failed check, or 0. Register values come from the bits of the data sheet. */
#include <adc10.h>
#include <adc12.h>
#include <can.h>
#include <dci.h>
#include <i2c.h>
#include <incap.h>
#include <outcompare.h>
#include <ports.h>
#include <pwm.h>
#include <qei.h>
#include <reset.h>
#include <spi.h>
#include <timer.h>
#include <uart.h>
#include <wdt.h>

#define CHECK(condition) \
    do {                 \
        if (!(condition)) \
            return __LINE__; \
    } while (0)

static int timers(void)
{
    OpenTimer1(T1_ON & T1_IDLE_STOP & T1_GATE_OFF & T1_PS_1_64 & T1_SYNC_EXT_OFF & T1_SOURCE_INT, 0x1234);
    CHECK(T1CON == 0xA020 && PR1 == 0x1234 && ReadTimer1() < 2);
    WriteTimer1(0x1000);
    CHECK(ReadTimer1() == 0x1000);
    ConfigIntTimer1(T1_INT_PRIOR_5 & T1_INT_ON);
    CHECK(IPC0bits.T1IP == 5 && IEC0bits.T1IE && !IFS0bits.T1IF);
    DisableIntT1;
    CHECK(!IEC0bits.T1IE);
    EnableIntT1;
    SetPriorityIntT1(2);
    CHECK(IPC0bits.T1IP == 2 && IEC0bits.T1IE);
    CloseTimer1();
    CHECK(T1CON == 0 && !IEC0bits.T1IE);
    OpenTimer23(T2_OFF & T2_IDLE_CON & T2_GATE_OFF & T2_PS_1_1 & T2_32BIT_MODE_ON & T2_SOURCE_INT, 0x12345678);
    CHECK(T2CON == 8 && PR3 == 0x1234 && PR2 == 0x5678 && ReadTimer23() == 0);
    WriteTimer23(0xABCD0123);
    CHECK(TMR3 == 0xABCD && TMR2 == 0x0123 && ReadTimer23() == 0xABCD0123);
    ConfigIntTimer23(T3_INT_PRIOR_6 & T3_INT_ON);
    CHECK(IPC1bits.T3IP == 6 && IEC0bits.T3IE && !IEC0bits.T2IE);
    CloseTimer23();
    CHECK(T2CON == 0 && !IEC0bits.T3IE);
    return 0;
}

static int captures_and_compares(void)
{
    unsigned buffer[4];
    OpenCapture1(IC_IDLE_STOP & IC_TIMER2_SRC & IC_INT_3CAPTURE & IC_EVERY_FALL_EDGE);
    CHECK(IC1CON == 0x20C2);
    ReadCapture1(buffer);
    ConfigIntCapture1(IC_INT_ON & IC_INT_PRIOR_3);
    CHECK(IPC0bits.IC1IP == 3 && IEC0bits.IC1IE);
    CloseCapture1();
    CHECK(!IC1CONbits.ICM && !IEC0bits.IC1IE);
    OpenOC1(OC_IDLE_CON & OC_TIMER3_SRC & OC_PWM_FAULT_PIN_DISABLE, 0x111, 0x222);
    CHECK((OC1CON & 0x200F) == 0x000E && OC1RS == 0x111 && OC1R == 0x222);
    SetPulseOC1(1, 2);
    SetDCOC1PWM(0x333);
    CHECK(OC1RS == 0x333 && ReadDCOC1PWM() == 0x333 && ReadRegOC1(1) == 0xFFFF);
    OpenOC1(OC_IDLE_CON & OC_TIMER2_SRC & OC_SINGLE_PULSE, 0, 0);
    SetDCOC1PWM(0x444);
    SetPulseOC1(7, 9);
    CHECK(OC1R == 7 && OC1RS == 9 && ReadRegOC1(1) == 7 && ReadRegOC1(0) == 9 && ReadDCOC1PWM() == 0xFFFF);
    ConfigIntOC1(OC_INT_ON & OC_INT_PRIOR_1);
    CHECK(IPC0bits.OC1IP == 1 && IEC0bits.OC1IE);
    CloseOC1();
    CHECK(!OC1CONbits.OCM && !IEC0bits.OC1IE);
    return 0;
}

static int uarts(void)
{
    static char text[] = "hello", got[8];
    unsigned nine[] = {0x101, 0x1FF, 0}, words[2];
    ConfigIntUART2(UART_RX_INT_EN & UART_RX_INT_PR6 & UART_TX_INT_DIS & UART_TX_INT_PR2);
    CHECK(IPC6bits.U2RXIP == 6 && IPC6bits.U2TXIP == 2 && IEC1bits.U2RXIE && !IEC1bits.U2TXIE);
    DisableIntU2RX;
    OpenUART2(UART_EN & UART_IDLE_CON & UART_DIS_WAKE & UART_EN_LOOPBACK & UART_DIS_ABAUD & UART_NO_PAR_8BIT & UART_1STOPBIT
#ifdef UART_RX_TX
                  & UART_RX_TX
#endif
              ,
              UART_INT_TX & UART_TX_PIN_NORMAL & UART_TX_ENABLE & UART_INT_RX_CHAR & UART_ADR_DETECT_DIS &
                  UART_RX_OVERRUN_CLEAR,
              3);
    CHECK(U2MODE == 0x8040 && (U2STA & 0x84E2) == 0x0440 && U2BRG == 3 && !BusyUART2() && !DataRdyUART2());
    WriteUART2(0x155);
    CHECK(BusyUART2());
    while (!DataRdyUART2())
        continue;
    CHECK(ReadUART2() == 0x55);
    putsUART2((unsigned *)text);
    CHECK(getsUART2(4, (unsigned *)got, 10000) == 0 && got[0] == 'h' && got[3] == 'l');
    CHECK(getsUART2(3, (unsigned *)got, 1000) == 2 && got[0] == 'o');
    CloseUART2();
    CHECK(!U2MODEbits.UARTEN);
    OpenUART2(UART_EN & UART_IDLE_CON & UART_DIS_WAKE & UART_EN_LOOPBACK & UART_DIS_ABAUD & UART_NO_PAR_9BIT & UART_2STOPBITS,
              UART_INT_TX_BUF_EMPTY & UART_TX_PIN_NORMAL & UART_TX_ENABLE & UART_INT_RX_BUF_FUL & UART_ADR_DETECT_DIS, 0);
    CHECK((U2MODE & 0xA0E7) == 0x8047 && (U2STA & 0x8CE0) == 0x84C0);
    putsUART2(nine);
    CHECK(getsUART2(2, words, 1000) == 0 && words[0] == 0x101 && words[1] == 0x1FF);
    CloseUART2();
    return 0;
}

static int spis(void)
{
    unsigned word = 0xBEEF, bytes[2];
    unsigned char *byte = (unsigned char *)bytes;
    OpenSPI1(FRAME_ENABLE_OFF & FRAME_SYNC_OUTPUT & ENABLE_SDO_PIN & SPI_MODE16_ON & SPI_SMP_ON & SPI_CKE_OFF & SLAVE_ENABLE_OFF &
                 CLK_POL_ACTIVE_HIGH & MASTER_ENABLE_ON & SEC_PRESCAL_3_1 & PRI_PRESCAL_4_1,
             SPI_ENABLE & SPI_IDLE_CON & SPI_RX_OVFLOW_CLR);
    CHECK(SPI1CON == 0x0636 && SPI1STAT == 0x8000 && ReadSPI1() == 0xFFFF);
    putsSPI1(1, &word);
    while (!DataRdySPI1())
        continue;
    word = ReadSPI1(); /* the level of the open input decides */
    CHECK((word == 0 || word == 0xFFFF) && !DataRdySPI1());
    CloseSPI1();
    OpenSPI1(FRAME_ENABLE_OFF & FRAME_SYNC_OUTPUT & ENABLE_SDO_PIN & SPI_MODE16_OFF & SPI_SMP_OFF & SPI_CKE_ON & SLAVE_ENABLE_OFF &
                 CLK_POL_ACTIVE_LOW & MASTER_ENABLE_ON & SEC_PRESCAL_8_1 & PRI_PRESCAL_1_1,
             SPI_ENABLE & SPI_IDLE_STOP & SPI_RX_OVFLOW_CLR);
    CHECK(SPI1CON == 0x0163 && SPI1STATbits.SPISIDL);
    WriteSPI1(0x1FF);
    byte[1] = 0x77;
    CHECK(getsSPI1(1, bytes, 1000) == 0 && byte[1] == 0x77 && getsSPI1(1, bytes, 100) == 1);
    ConfigIntSPI1(SPI_INT_PRI_4 & SPI_INT_EN);
    CHECK(IPC2bits.SPI1IP == 4 && IEC0bits.SPI1IE);
    CloseSPI1();
    CHECK(!SPI1STATbits.SPIEN && !IEC0bits.SPI1IE);
    return 0;
}

#ifdef MEMORY_ADDRESS
/* A memory at this address returns the bytes that it got. */
static int i2c_memory(void)
{
    unsigned char text[] = "ab", got[2] = {0, 0};
    StartI2C();
    IdleI2C();
    CHECK(MasterWriteI2C(MEMORY_ADDRESS << 1) == 0);
    IdleI2C();
    CHECK(!I2CSTATbits.ACKSTAT && MasterputsI2C(text) == 0);
    RestartI2C();
    IdleI2C();
    MasterWriteI2C(MEMORY_ADDRESS << 1 | 1);
    IdleI2C();
    CHECK(!I2CSTATbits.ACKSTAT && MastergetsI2C(2, got, 20000) == 0 && got[0] == 'a' && got[1] == 'b');
    StopI2C();
    IdleI2C();
    StartI2C();
    IdleI2C();
    MasterWriteI2C(MEMORY_ADDRESS << 1 | 1);
    IdleI2C();
    CHECK(MasterReadI2C() == 'a' && !DataRdyI2C());
    NotAckI2C();
    IdleI2C();
    StopI2C();
    IdleI2C();
    return 0;
}
#endif

static int i2cs(void)
{
    OpenI2C(I2C_ON & I2C_IDLE_CON & I2C_CLK_REL & I2C_IPMI_DIS & I2C_7BIT_ADD & I2C_SLW_DIS & I2C_SM_DIS & I2C_GCALL_DIS &
                I2C_STR_DIS & I2C_ACK & I2C_ACK_DIS & I2C_RCV_DIS & I2C_STOP_DIS & I2C_RESTART_DIS & I2C_START_DIS,
            35);
    CHECK(I2CCON == 0x9200 && I2CBRG == 35);
#ifdef MEMORY_ADDRESS
    int failed = i2c_memory();
    if (failed)
        return failed;
#endif
    ConfigIntI2C(SI2C_INT_ON & SI2C_INT_PRI_3 & MI2C_INT_OFF & MI2C_INT_PRI_6);
    CHECK(IPC3bits.SI2CIP == 3 && IPC3bits.MI2CIP == 6 && IEC0bits.SI2CIE && !IEC0bits.MI2CIE);
    CloseI2C();
    CHECK(!I2CCONbits.I2CEN && !IEC0bits.SI2CIE);
    return 0;
}

#ifdef ADC_MODULE_ON
#ifdef ADC_CONVERT_CH0
#define OpenADC12 OpenADC10
#define ConvertADC12 ConvertADC10
#define BusyADC12 BusyADC10
#define ReadADC12 ReadADC10
#define CloseADC12 CloseADC10
#define SetChanADC12 SetChanADC10
#define ConfigIntADC12 ConfigIntADC10
#define ONE_CHANNEL (ADC_CONVERT_CH0 & ADC_SAMPLE_INDIVIDUAL)
#else
#define ONE_CHANNEL 0xFFFF
#endif
static int converter(void)
{
    SetChanADC12(ADC_CH0_POS_SAMPLEA_AN7 & ADC_CH0_NEG_SAMPLEA_NVREF & ADC_CH0_POS_SAMPLEB_AN2 & ADC_CH0_NEG_SAMPLEB_AN1);
    CHECK((ADCHS & 0x1F1F) == 0x1207);
    OpenADC12(ADC_MODULE_ON & ADC_IDLE_CONTINUE & ADC_FORMAT_INTG & ADC_CLK_MANUAL & ADC_AUTO_SAMPLING_OFF & ADC_SAMP_OFF &
                  ONE_CHANNEL & 0xFFFE,
              ADC_VREF_AVDD_AVSS & ADC_SCAN_OFF & ADC_SAMPLES_PER_INT_3 & ADC_ALT_BUF_OFF & ADC_ALT_INPUT_OFF & (ONE_CHANNEL | 0xFCFF),
              ADC_SAMPLE_TIME_5 & ADC_CONV_CLK_SYSTEM & ADC_CONV_CLK_13Tcy, ENABLE_AN7_ANA & ENABLE_AN2_ANA, SCAN_NONE);
    CHECK((ADCON1 & 0xA3E6) == 0x8000 && (ADCON2 & 0xE73F) == 0x0008 && ADCON3 == 0x0519);
    CHECK((ADPCFG & 0x84) == 0 && ADCSSL == 0);
    ADCON1bits.SAMP = 1;
    ConvertADC12();
    CHECK(BusyADC12());
    while (BusyADC12())
        continue;
    CHECK(ReadADC12(0) == ADCBUF0);
    ConfigIntADC12(ADC_INT_PRI_7 & ADC_INT_ENABLE);
    CHECK(IPC2bits.ADIP == 7);
    CloseADC12();
    CHECK(!ADCON1bits.ADON && !IEC0bits.ADIE);
    return 0;
}
#endif

#ifdef CAN_TX_REQ
static int cans(void)
{
    unsigned char sent[8] = {1, 2, 3, 4, 5, 6, 7, 8}, got[8] = {0};
    CAN1SetOperationMode(CAN_IDLE_CON & CAN_MASTERCLOCK_1 & CAN_REQ_OPERMODE_CONFIG & CAN_CAPTURE_DIS);
    CHECK(C1CTRL == 0x0C80);
    CAN1Initialize(CAN_SYNC_JUMP_WIDTH2 & CAN_BAUD_PRE_SCALE(3),
                   CAN_WAKEUP_BY_FILTER_DIS & CAN_PHASE_SEG2_TQ(4) & CAN_PHASE_SEG1_TQ(3) & CAN_PROPAGATIONTIME_SEG_TQ(2) &
                       CAN_SEG2_FREE_PROG & CAN_SAMPLE1TIME);
    CHECK(C1CFG1 == 0x0042 && C1CFG2 == 0x0391);
    CAN1SetFilter(0, CAN_FILTER_SID(0x5A3) & CAN_RX_EID_EN, CAN_FILTER_EID(0x2ABCD));
    CHECK(C1RXF0SID == (0x5A3 << 2 | 1) && C1RXF0EIDH == 0x2ABCD >> 6 && C1RXF0EIDL == (0x2ABCDL << 10 & 0xFC00));
    CAN1SetFilter(5, CAN_FILTER_SID(1) & CAN_RX_EID_DIS, CAN_FILTER_EID(0));
    CHECK(C1RXF5SID == 4);
    CAN1SetMask(0, CAN_MASK_SID(0x7FF) & CAN_MATCH_FILTER_TYPE, CAN_MASK_EID(0x3FFFF));
    CHECK(C1RXM0SID == 0x1FFD && C1RXM0EIDH == 0x0FFF && C1RXM0EIDL == 0xFC00);
    CAN1SetMask(1, CAN_MASK_SID(0) & CAN_IGNORE_FILTER_TYPE, 0);
    CHECK(C1RXM1SID == 0);
    CAN1SetRXMode(0, CAN_RXFUL_CLEAR & CAN_BUF0_DBLBUFFER_EN);
    CHECK(C1RX0CONbits.DBEN && !CAN1IsRXReady(0));
    CAN1SetTXMode(0, CAN_TX_STOP_REQ & CAN_TX_PRIORITY_HIGH_INTER);
    CHECK(C1TX0CON == 2 && CAN1IsTXReady(0));
    CAN1SetOperationMode(CAN_IDLE_CON & CAN_MASTERCLOCK_1 & CAN_REQ_OPERMODE_LOOPBK & CAN_CAPTURE_DIS);
    CHECK(C1CTRLbits.OPMODE == 2);
    CAN1SendMessage(CAN_TX_SID(0x5A3) & CAN_TX_EID_EN & CAN_SUB_REM_TX_REQ, CAN_TX_EID(0x2ABCD) & CAN_NOR_TX_REQ, sent, 7, 0);
    CHECK(C1TX0SID == 0xB08F); /* 0x5A3 in bits 15 to 11 and 7 to 2 */
    CHECK((C1TX0EID & 0xF0FF) == 0xA0AF && (C1TX0DLC & 0xFE78) == (0xD << 10 | 7 << 3));
    while (!CAN1IsRXReady(0))
        continue;
    CHECK(CAN1IsTXReady(0));
    CAN1ReceiveMessage(got, 7, 0);
    CHECK(got[0] == 1 && got[6] == 7 && got[7] == 0 && C1RX0DLCbits.DLC == 7);
    CHECK(!CAN1IsTXPassive() && !CAN1IsRXPassive() && !CAN1IsBusOff() && !CAN1GetTXErrorCount() && !CAN1GetRXErrorCount());
    ConfigIntCAN1(CAN_INDI_INVMESS_DIS & CAN_INDI_WAK_DIS & CAN_INDI_ERR_EN & CAN_INDI_TXB2_DIS & CAN_INDI_TXB1_DIS & CAN_INDI_TXB0_EN &
                      CAN_INDI_RXB1_DIS & CAN_INDI_RXB0_EN,
                  CAN_INT_PRI_6 & CAN_INT_DISABLE);
    CHECK((C1INTE & 0xFF) == 0x25 && IPC6bits.C1IP == 6 && !IEC1bits.C1IE);
    CAN1AbortAll();
    CAN1SetOperationModeNoWait(CAN_IDLE_CON_NO_WAIT & CAN_MASTERCLOCK_1_NO_WAIT & CAN_REQ_OPERMODE_CONFIG_NO_WAIT & CAN_CAPTURE_DIS_NO_WAIT);
    CHECK(C1CTRLbits.REQOP == 4);
    return 0;
}
#endif

#ifdef DCI_EN
static int audio(void)
{
    OpenDCI(DCI_EN & DCI_IDLE_CON & DCI_DIGI_LPBACK_EN & DCI_SCKD_OUP & DCI_SAMP_CLK_FAL & DCI_FSD_OUP & DCI_TX_LASTVAL_UNF &
                DCI_SDO_ZERO & DCI_DJST_OFF & DCI_FSM_I2S,
            DCI_BUFF_LEN_4 & DCI_FRAME_LEN_4 & DCI_DATA_WORD_16, 9, DCI_EN_SLOT_ALL & DCI_DIS_SLOT_15 & DCI_DIS_SLOT_4, DCI_DIS_SLOT_ALL);
    CHECK(DCICON1 == 0x8881 && DCICON2 == 0x0C6F && DCICON3 == 9 && TSCON == 0x7FEF && RSCON == 0);
    WriteDCI(0x4321, 2);
    CHECK(TXBUF2 == 0x4321 && ReadDCI(3) == RXBUF3 && BufferEmptyDCI() == DCISTATbits.TMPTY && !DataRdyDCI());
    ConfigIntDCI(DCI_INT_PRI_5 & DCI_INT_ON);
    CHECK(IPC10bits.DCIIP == 5);
    CloseDCI();
    CHECK(!DCICON1bits.DCIEN && !IEC2bits.DCIIE);
    return 0;
}
#endif

#ifdef PWM_EN
static int motors(void)
{
    OpenMCPWM(0x123, 0x45, PWM_EN & PWM_IDLE_CON & PWM_OP_SCALE3 & PWM_IPCLK_SCALE4 & PWM_MOD_UPDN,
              PWM_MOD3_COMP & PWM_MOD2_IND & PWM_MOD1_COMP & PWM_PDIS3H & PWM_PEN2H & PWM_PEN1H & PWM_PDIS3L & PWM_PDIS2L & PWM_PEN1L,
              PWM_SEVOPS5 & PWM_OSYNC_TCY & PWM_UEN);
    CHECK(PTCON == 0x8026 && PTPER == 0x123 && SEVTCMP == 0x45 && PWMCON1 == 0x0231 && PWMCON2 == 0x0400);
    SetDCMCPWM(2, 0x99, 1);
    CHECK(PDC2 == 0x99 && PWMCON2bits.UDIS);
    OverrideMCPWM(PWM_GEN_3H & PWM_GEN_3L & PWM_POUT_2H & PWM_GEN_2L & PWM_GEN_1H & PWM_POUT_1L & PWM_POUT3H_INACT & PWM_POUT3L_INACT &
                  PWM_POUT2H_ACT & PWM_POUT2L_INACT & PWM_POUT1H_INACT & PWM_POUT1L_ACT);
    CHECK(OVDCON == 0x3609);
    SetMCPWMDeadTimeGeneration(PWM_DTAPS4 & PWM_DTA17);
    CHECK(DTCON1 == 0x0091);
    SetMCPWMFaultA(PWM_OVA3H_INACTIVE & PWM_OVA2H_ACTIVE & PWM_OVA1H_INACTIVE & PWM_OVA3L_INACTIVE & PWM_OVA2L_INACTIVE &
                   PWM_OVA1L_ACTIVE & PWM_FLTA_MODE_CYCLE & PWM_FLTA3_DIS & PWM_FLTA2_EN & PWM_FLTA1_DIS);
    CHECK((FLTACON & 0x3F87) == 0x0982);
    ConfigIntMCPWM(PWM_INT_EN & PWM_INT_PR3 & PWM_FLTA_DIS_INT & PWM_FLTA_INT_PR2);
    CHECK(IPC9bits.PWMIP == 3 && IPC10bits.FLTAIP == 2 && IEC2bits.PWMIE && !IEC2bits.FLTAIE);
    CloseMCPWM();
    CHECK(!PTCONbits.PTEN && !IEC2bits.PWMIE);
    OpenQEI(QEI_DIR_SEL_CNTRL & QEI_INT_CLK & QEI_INDEX_RESET_DISABLE & QEI_CLK_PRESCALE_64 & QEI_GATED_ACC_DISABLE & QEI_NORMAL_IO &
                QEI_INPUTS_SWAP & QEI_MODE_x2_MATCH & QEI_UP_COUNT & QEI_IDLE_CON,
            QEI_QE_CLK_DIVIDE_1_32 & QEI_QE_OUT_ENABLE & POS_CNT_ERR_INT_DISABLE & MATCH_INDEX_PHASEB_HIGH & MATCH_INDEX_PHASEA_LOW);
    CHECK((QEICON & 0x27FF) == 0x0590 && DFLTCON == 0x05C0);
    WriteQEI(0x777);
    CHECK(ReadQEI() == 0x777);
    ConfigIntQEI(QEI_INT_ENABLE & QEI_INT_PRI_1);
    CHECK(IPC10bits.QEIIP == 1 && IEC2bits.QEIIE);
    CloseQEI();
    CHECK(!QEICONbits.QEIM && !IEC2bits.QEIIE);
    return 0;
}
#endif

static int lines_and_resets(void)
{
    ConfigINT2(FALLING_EDGE_INT & EXT_INT_ENABLE & EXT_INT_PRI_5);
    CHECK(INTCON2bits.INT2EP && IPC5bits.INT2IP == 5 && IEC1bits.INT2IE);
    configINT1(RISING_EDGE_INT & EXT_INT_DISABLE & EXT_INT_PRI_1);
    CHECK(!INTCON2bits.INT1EP && IPC4bits.INT1IP == 1 && !IEC1bits.INT1IE);
    CloseINT2();
    CHECK(!IEC1bits.INT2IE);
    ConfigCNPullups(0x00020005);
    CHECK(CNPU1 == 5 && CNPU2 == 2);
    ConfigIntCN(CHANGE_INT_OFF & CHANGE_INT_PRI_3 & 0xFF000006);
    CHECK(CNEN1 == 6 && CNEN2 == 0 && IPC3bits.CNIP == 3 && !IEC0bits.CNIE);
    EnableCN5;
    DisableCN2;
    CHECK(CNEN1 == 0x22);
    RCON = 0x0080;
    CHECK(isMCLR() && !isPOR() && !isBOR() && !isWDTTO() && !isWU());
    PORStatReset;
    BORStatReset;
    CHECK(isPOR() && isBOR());
    RCON = 0x0018;
    CHECK(isWDTTO() && isWDTWU() && !isWU());
    RCON = 0x0008;
    CHECK(isWU() && !isWDTWU());
    EnableWDT(WDT_ENABLE);
    ClearWDT();
    CHECK(RCONbits.SWDTEN);
    DisableWDT(WDT_DISABLE);
    CHECK(!RCONbits.SWDTEN);
    DisableInterrupts(5);
    return 0;
}

int main(void)
{
    static int (*const parts[])(void) = {
        timers, captures_and_compares, uarts, spis, i2cs, lines_and_resets,
#ifdef ADC_MODULE_ON
        converter,
#endif
#ifdef CAN_TX_REQ
        cans,
#endif
#ifdef DCI_EN
        audio,
#endif
#ifdef PWM_EN
        motors,
#endif
    };
    INTCON1bits.NSTDIS = 1;
    SRbits.IPL = 7; /* the interrupts are only configured */
    for (unsigned i = 0; i < sizeof parts / sizeof *parts; i++) {
        int failed = parts[i]();
        if (failed)
            return failed;
    }
    return 0;
}
